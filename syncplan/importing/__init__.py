"""Files of the field: KML, KMZ, GeoJSON, GPX, QGroundControl plans, fence lists, survey points."""
