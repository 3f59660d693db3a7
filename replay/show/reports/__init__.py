"""Whole documents: the reports of replays, diagnoses and protocols, and the layers for the viewer."""
