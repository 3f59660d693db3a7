"""From a recorded session to a sealed run of the twin."""
