"""Numbers side by side in vector registers, and powers with the same bits on every machine."""
