"""The report of a pose evaluation: tables, figures, views of the worst sequences, and the page that holds them."""
