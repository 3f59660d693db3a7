"""Events in a hash-chained ledger, sealed bytes under their SHA-256, and what both say is true now.

`store` is the folder, `ledger` its facts (`events`, each in a `ledger_row`, chained by `chain`), `archive` its sealed
bytes, both put on disk by `durable`, by one writer at a time (`ledger_lock`). `facts` folds the events into what is
true now or was at a time, without what was taken back (`standing`); `ledger_index` knows where each fact lies, so that
`lookups` read what is asked for and no more; who reads all has each row checked against all before it
(`ledger_history`). `sessions` groups files, `named` finds what people call by name. `ledger_audit` and `store_check`
list all damage, and `cited` says what stands on it. `sweeping` removes the bytes of what was forgotten. `as_of` opens
the store as it was, `backup` makes a second one of it, `lineage` says what a fact follows from. `alias` names a folder
as other libraries take it. Out of the folder lie, where a store says so, its ledger (`ledger_place`, `ledger_server`,
`ledger_table`, `move`) and its files (`bucket`, `move_files`).
"""
