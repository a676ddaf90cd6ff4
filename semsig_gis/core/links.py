"""Links to public maps and street-level photographs of a place."""

from __future__ import annotations


def place_links(lat: float, lon: float, *, heading: float | None = None) -> dict[str, str]:
    """Return the addresses of public maps and street-level photographs of a place.

    Parameters
    ----------
    lat, lon : float
        The place in degrees, WGS 84.
    heading : float, optional
        Where the viewer looks, in degrees clockwise from true north; only Google Street View uses
        it.

    Returns
    -------
    dict of str to str
        Address by title. Nothing is requested.

    Examples
    --------
    >>> place_links(43.7384, 7.4246, heading=90.0)["OpenStreetMap"]
    'https://www.openstreetmap.org/?mlat=43.73840&mlon=7.42460&zoom=19'
    """
    latitude, longitude = f"{lat:.6f}", f"{lon:.6f}"
    look = "" if heading is None else f"&heading={round(heading) % 360}"
    place = f"{latitude}/{longitude}"
    return {
        "OpenStreetMap": f"https://www.openstreetmap.org/?mlat={lat:.5f}&mlon={lon:.5f}&zoom=19",
        "Google Street View": (
            "https://www.google.com/maps/@?api=1&map_action=pano"
            f"&viewpoint={latitude},{longitude}{look}"
        ),
        "Mapillary": f"https://www.mapillary.com/app/?lat={latitude}&lng={longitude}&z=18",
        "Panoramax": f"https://api.panoramax.xyz/#focus=map&map=18/{place}",
        "KartaView": f"https://kartaview.org/map/@{latitude},{longitude},18z",
    }
