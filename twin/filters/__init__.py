"""Temperatures and unknowns estimated while readings come in: Kalman filters and a smoother."""
