"""Spoilt files of a user, by a seed: each is refused in one clear line or works.

`byte_mutations` spoils any file, `table_mutations` what a TOML file says; `configurations` applies both to what is shipped
and judges what comes of it. Other kinds of files need a module like `configurations`, and a line in `__main__`.
"""
