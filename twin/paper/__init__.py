"""The paper's own form of network and filter: the reference that ours are measured against. No verb needs it."""
