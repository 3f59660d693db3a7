"""Motor files made from nothing, from motors of another size, and from motors of more nodes."""
