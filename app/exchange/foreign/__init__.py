"""Tables, dumps and spots of other programs, read as observations and written as experiment folders."""
