"""One log on its way from bytes to samples: read, recorded, decoded, every record accounted for."""
