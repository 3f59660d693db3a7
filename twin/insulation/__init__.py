"""What DC checks say of one specimen's insulation, and the state that they leave.

`insulation_fit` fits all checks of a specimen together in the network of their rig, each check cut down to what matters
by `check_tests`. `ageing_state` follows the state that checks leave as the dose grows.
"""
