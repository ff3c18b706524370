"""Tables of the first-sighting protocol of the open loop."""
