"""What people and programs write, read strictly: one line says what is wrong, and where.

Begin with `yaml_file.read_yaml_file`, which keeps the line of every value, and `files.FileError`,
the one error of them all. Nothing but `yaml_file` needs more than Python itself, so that a program
can use the rest before it has installed anything.

Public modules: `files` (errors in one line, bounded reading, three ways to write),
`one_line` (any text as one line), `regular_files` (the same, with plain OS errors), `settings`
(fields of records with bounds), `suggestions` (the nearest name of a mistyped one),
`yaml_file` (YAML with the line of each key).
"""
