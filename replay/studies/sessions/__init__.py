"""Stored sessions as fits take them, and what surrounds a fit."""
