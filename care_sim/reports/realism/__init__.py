"""What realistic conditions do to the orders of the headline tables."""
