"""Where motion files come from: folders on this machine, and public files to fetch."""
