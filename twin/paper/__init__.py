"""The paper's own form of network and filter: the reference that ours are measured against. No verb needs it.

`form` is the network as the paper writes it (Eq. 1-4), `law_heats` its laws, `ekf` over `ekf_step` its filter (Eq.
5-13).
"""
