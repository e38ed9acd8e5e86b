"""The routes of `/api/v1` and what stands beside them; one file per concept."""
