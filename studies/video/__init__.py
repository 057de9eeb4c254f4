"""The study of avatars that follow people in videos."""
