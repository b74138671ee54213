"""What a person looks at and types: watching a mission, the console, drawing places."""
