"""From readings to signals: zero, temperature, chip faults and what estimators on signals share."""
