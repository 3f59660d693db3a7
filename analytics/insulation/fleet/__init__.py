"""Many specimens at once: who is not as the others, and how much dose each has left."""
