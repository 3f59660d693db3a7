"""What each verb prints, as text 100 columns wide, as JSON and as a picture."""
