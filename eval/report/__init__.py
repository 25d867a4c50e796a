"""Tables, statistics and the HTML report, as functions of records alone."""
