"""What holds speed, engines and machines to account."""
