"""A network made into code: indices, laws as text and as a program, derivatives, integrator."""
