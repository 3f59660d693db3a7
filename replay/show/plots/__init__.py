"""One picture each: measured against model, errors by cell, heat, filters, networks."""
