"""Numbers, places and findings in plain words, colours and one empty figure or page: what every view is made of."""
