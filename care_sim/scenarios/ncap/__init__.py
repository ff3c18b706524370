"""The Euro NCAP tests of emergency braking: their numbers, and the world of each at a speed."""
