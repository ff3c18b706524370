"""Controls: policies that are no contenders, and show what a result depends on."""
