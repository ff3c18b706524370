"""What several tests make: logs, databases, rows, processes."""
