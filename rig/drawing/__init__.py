"""What figures are drawn with: style, pages, and axes that several figures share."""
