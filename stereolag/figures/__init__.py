"""Results made visible: Plotly figures and coloured images. Knows no Streamlit."""
