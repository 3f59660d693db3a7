"""What DC checks say of one specimen's insulation, and the state that they leave."""
