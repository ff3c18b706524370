"""The golden file of the numbers that published folders print, and how today's are compared."""
