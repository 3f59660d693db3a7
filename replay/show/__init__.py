"""What people see: text for the terminal, HTML reports, layers for the rerun viewer.

Rooms from the bottom up; each imports from those before it only: `words`, `plots`, `verbs`, `viewer`, `reports`,
`notebooks`.
"""
