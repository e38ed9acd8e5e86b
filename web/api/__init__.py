"""Routes of `/api/v1`, and the health routes; one file per concept."""
