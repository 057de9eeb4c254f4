"""Looking at results: 3D recordings, filmstrips, video and plots of what was decided."""
