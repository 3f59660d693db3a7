"""The paper's own form of the filter: the reference that ours are measured against. No verb needs it.

`ekf` over `ekf_step` is the paper's filter (Eq. 5-13), with its numbers where `rates` says. The network as the paper
writes it (Eq. 1-4) is the tests' own.
"""
