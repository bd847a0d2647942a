"""The paper's table, printed beside ours (Iiyama et al., AAS 20-583: means over 1000 episodes)."""

PAPER_ROWS: dict[str, dict[str, float]] = {
    "TD3": {
        "safe_site_percent": 94.8,
        "miss_distance_m": 2.492,
        "touchdown_speed_mps": 0.637,
        "propellant_percent": 69.88,
        "minimum_slant_angle_deg": 72.429,
        "maximum_thrust_n": 5818.0,
    },
    "TD3 + LSTM": {
        "safe_site_percent": 88.3,
        "miss_distance_m": 4.547,
        "touchdown_speed_mps": 1.520,
        "propellant_percent": 63.70,
        "minimum_slant_angle_deg": 72.570,
        "maximum_thrust_n": 6863.0,
    },
    "Fixed Control": {
        "safe_site_percent": 93.2,
        "miss_distance_m": 3.786,
        "touchdown_speed_mps": 1.189,
        "propellant_percent": 67.84,
        "minimum_slant_angle_deg": 72.795,
        "maximum_thrust_n": 4553.0,
    },
    "Single Divert": {
        "safe_site_percent": 89.7,
        "miss_distance_m": 0.005,
        "touchdown_speed_mps": 0.557,
        "propellant_percent": 68.89,
        "minimum_slant_angle_deg": 70.85,
        "maximum_thrust_n": 4556.0,
    },
}
