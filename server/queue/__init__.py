"""The farm's queue: every slice is a durable workflow (DBOS) on the store's own database.

`durable` speaks to DBOS; `dispatch` decides where a slice goes; `ledger` hands slices to workers and takes their
outcomes, each in one transaction; `lives` keeps track of workers and hands on what a dead one held.
"""
