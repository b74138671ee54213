"""What people and programs write, read strictly: one line says what is wrong, and where.

Begin with `yaml_file.read_yaml_file`, which keeps the line of every value. `files` reads with a
bound and writes without half a file, `settings` declares fields with bounds, `suggestions` knows
the nearest name of a mistyped one.
"""
