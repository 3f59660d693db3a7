"""A motor as data: nodes, links, laws, sensors, what is refused, and motors made from motors. Nothing runs here."""
