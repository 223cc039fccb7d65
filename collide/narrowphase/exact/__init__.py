"""The exact stage: what doubles leave open is settled in integers. One front door: `exact_stage.settle_rows`."""
