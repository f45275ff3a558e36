"""What the dashboard shows about a run: verdict, points, map and links, as artifacts of a Prefect server."""
