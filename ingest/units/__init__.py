"""Work in units: one function over many jobs, in this process, in several, or on the machines of a cluster.

`each` hands the jobs out and takes the results in; `shared` is what all jobs of a piece of work share, read once a
process. Names, keys and small answers travel; samples and runs stay files.
"""
