"""The notebooks that come with the program: which there are, and what their cells show.

`shelf` finds, opens and writes them; `cells` makes tables and charts that marimo shows alive and Jupyter without a
network.
"""
