"""Loop closure: places that are visited again, found, verified and made consistent."""
