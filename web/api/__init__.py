"""Routes of `/api/v1`, and the health routes; by concept."""
