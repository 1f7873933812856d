"""Results made visible: Plotly figures and coloured pictures. Knows no Streamlit."""
