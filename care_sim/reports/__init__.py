"""Tables, figures and pages: pure functions of the rows of a study."""
