"""Which cause the data ask for, what cannot be told apart, what stays unknown, and what naming gained."""
