"""Files at the door: they become facts, sessions and inspections, or are only looked into.

`intake` is `whyhot ingest`: `given` finds the logs in what was given, `archives` unpacks them, `making` records and
decodes them; `setup` checks bench file, databases and motor file before anything is kept, `grouping` puts files into
sessions. `inspection` looks without storing, `attachments` seals photographs with what was found. `retractions` and
`corrections` put right by a person's word what was taken in, `upgrade` decodes anew what an earlier version took in,
`located` finds records again in sealed bytes.
"""
