"""Tables of numbers as text: encoding, layout, and rows, of which a compiled parser reads what is plain."""
