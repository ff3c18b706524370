"""The options of every command, as plain data: they load no simulator, so help is quick."""
