"""The catalogue: what a session holds, how good it is, whether its power balances, where it was driven, what it was."""
