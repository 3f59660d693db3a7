"""What each verb prints, as text as wide as the terminal, as JSON and as a picture."""
