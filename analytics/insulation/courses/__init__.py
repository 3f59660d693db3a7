"""What ln R does over dose: the form of one specimen's deterioration, and what each kind of stress did to it."""
