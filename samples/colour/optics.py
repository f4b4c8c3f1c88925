"""What an eye sees of a print, from the materials of its voxels.

Ink under a surface     a point of a facet shows the integral over the depth z of exp(-z / l) / l times the linear colour of
                        the material there; z counts printed matter alone, from the first printed voxel; l = 0 shows that voxel
Spread of drops         a Gaussian in the plane of the facet; its standard deviation of 25 um is assumed
The eye                 S-CIELAB: Zhang, Wandell: A Spatial Extension of CIELAB for Digital Color Image Reproduction, SID
                        Symposium Digest 27, 1996, pp. 731-734: opponent channels and their filters
Mixtures                Yule, Nielsen: The Penetration of Light into Paper and its Effect on Halftone Reproduction, TAGA
                        Proceedings 3, 1951, applied to each channel of linear RGB: R = (sum c_i R_i^(1/n))^n
Differences             CIEDE2000: Sharma, Wu, Dalal: The CIEDE2000 Color-Difference Formula, Color Research and Application
                        30(1), 2005, pp. 21-30, equations 2-22

Colours are linear, with the primaries of Rec. 709 and the white D65; 1 is a perfect white.
"""

import numpy as np

XYZ_OF_RGB = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])
WHITE = XYZ_OF_RGB.sum(axis=1)

# Zhang and Wandell: the channels luminance, red-green and blue-yellow, with the digits of the authors' program; the paper
# rounds them and prints 0.077 with the wrong sign, which would make white reddish. Their filters are sums of Gaussians
# exp(-r^2 / s^2), here (weight, s in degrees of visual angle); each Gaussian and the sum are scaled to an integral of 1.
OPPONENT_OF_XYZ = np.array([[278.7336, 721.8031, -106.5520], [-448.7736, 289.8056, 77.1569],
                            [85.9513, -589.9859, 501.1089]]) / 1000
FILTERS = (((0.921, 0.0283), (0.105, 0.133), (-0.108, 4.336)), ((0.531, 0.0392), (0.330, 0.494)),
           ((0.488, 0.0536), (0.371, 0.386)))

VIEWING_DISTANCE_MM = 300
DROP_SIGMA_MM = 0.025
DEFAULT_YULE_NIELSEN = 2


def linear(encoded):
    """Returns linear values of encoded sRGB values from 0 to 1 (IEC 61966-2-1)."""
    encoded = np.asarray(encoded, float)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4)


def encoded(values):
    """Returns sRGB values from 0 to 1 of linear values."""
    values = np.clip(values, 0, 1)
    return np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)


def lab(rgb):
    """Returns CIELAB [..., 3] of linear RGB [..., 3], for D65."""
    return lab_of_xyz(np.asarray(rgb, float) @ XYZ_OF_RGB.T)


def lab_of_xyz(xyz, white=WHITE):
    x, y, z = np.moveaxis(_compressed(xyz / white), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def lightness(luminance):
    """Returns L* of luminances relative to white."""
    return 116 * _compressed(luminance) - 16


def _compressed(share):
    return np.where(share > (6 / 29) ** 3, np.cbrt(share), share * (29 / 6) ** 2 / 3 + 4 / 29)


def ciede2000(lab_1, lab_2):
    """Returns the CIEDE2000 differences [...] between CIELAB colours [..., 3]; kL = kC = kH = 1."""
    (l1, a1, b1), (l2, a2, b2) = (np.moveaxis(np.asarray(colour, float), -1, 0) for colour in (lab_1, lab_2))
    chroma_7 = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2) ** 7
    stretch = 1.5 - 0.5 * np.sqrt(chroma_7 / (chroma_7 + 25.0**7))
    c1, c2 = np.hypot(a1 * stretch, b1), np.hypot(a2 * stretch, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a * stretch)) % 360 for a, b in ((a1, b1), (a2, b2)))
    coloured = c1 * c2 > 0
    turn = np.where(coloured, (h2 - h1 + 180) % 360 - 180, 0)
    turn = np.where(coloured & (h2 - h1 == 180), 180, turn)
    d_l, d_c, d_h = l2 - l1, c2 - c1, 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn) / 2)
    l, c = (l1 + l2) / 2, (c1 + c2) / 2
    wrap = np.where(h1 + h2 < 360, 360, -360)
    h = np.where(coloured, (h1 + h2 + np.where(np.abs(h1 - h2) > 180, wrap, 0)) / 2, h1 + h2)
    cosine = [np.cos(np.radians(angle)) for angle in (h - 30, 2 * h, 3 * h + 6, 4 * h - 63)]
    t = 1 - 0.17 * cosine[0] + 0.24 * cosine[1] + 0.32 * cosine[2] - 0.20 * cosine[3]
    s_l = 1 + 0.015 * (l - 50) ** 2 / np.sqrt(20 + (l - 50) ** 2)
    s_c, s_h = 1 + 0.045 * c, 1 + 0.015 * c * t
    turned = np.sin(np.radians(60 * np.exp(-(((h - 275) / 25) ** 2)))) * -2 * np.sqrt(c**7 / (c**7 + 25.0**7))
    parts = d_l / s_l, d_c / s_c, d_h / s_h
    return np.sqrt(np.maximum(sum(part**2 for part in parts) + turned * parts[1] * parts[2], 0))


def material_colours(materials):
    """Returns the linear colours [materials, 3] of the materials of a stack: "linear_rgb" where known, otherwise "rgba"."""
    return np.array([entry["linear_rgb"] if "linear_rgb" in entry else linear(np.array(entry["rgba"][:3]) / 255)
                     for entry in materials], float)


def yule_nielsen(profile):
    """Returns n for red, green and blue, [3], of a printer profile."""
    return np.broadcast_to(np.asarray(profile.get("yule_nielsen", DEFAULT_YULE_NIELSEN), float), 3)


def mixed(coverages, colours, n):
    """Returns the linear colours [..., 3] of mixtures: coverages [..., materials], colours [materials, 3], n a number or [3]."""
    return (np.asarray(coverages) @ np.asarray(colours) ** (1 / np.asarray(n))) ** n


class Eye:
    """The filters for square pictures of `count` x `count` samples, `spacing_mm` apart, which continue periodically.

    A picture is given as shares of materials, because their spectra serve every colour of the materials.
    """

    def __init__(self, count, spacing_mm, distance_mm=VIEWING_DISTANCE_MM, drop_sigma_mm=DROP_SIGMA_MM):
        self.count = count
        along = np.fft.fftfreq(count, spacing_mm)[:, None]
        across = np.fft.rfftfreq(count, spacing_mm)[None, :]
        squared = along**2 + across**2  # (cycles / mm)^2
        degree_mm = distance_mm * np.tan(np.radians(1))
        self.channels = []
        for gaussians in FILTERS:
            total = sum(weight for weight, _ in gaussians)
            self.channels.append(sum(weight / total * np.exp(-squared * (np.pi * spread * degree_mm) ** 2)
                                     for weight, spread in gaussians))
        self.drop = np.exp(-2 * squared * (np.pi * drop_sigma_mm) ** 2)
        self.luminance_of = np.linalg.inv(OPPONENT_OF_XYZ)[1]
        self.grey = self._luminance_filter(np.ones(3))

    def _luminance_filter(self, rgb):
        """Returns the spectrum of the seen luminance of a point of linear colour `rgb`."""
        opponent = OPPONENT_OF_XYZ @ XYZ_OF_RGB @ rgb
        return self.drop * sum(self.luminance_of[i] * opponent[i] * self.channels[i] for i in range(3))

    def spectra(self, shares):
        """Returns the spectra of pictures, [..., count x count]."""
        return np.fft.rfft2(np.reshape(shares, (*np.shape(shares)[:-1], self.count, self.count)))

    def lightness_of(self, spectra, colours):
        """Returns the seen L*, [count, count], of materials with these spectra and linear colours [materials, 3]."""
        seen = sum(spectrum * self._luminance_filter(colour) for spectrum, colour in zip(spectra, colours))
        return lightness(np.fft.irfft2(seen, (self.count, self.count)))

    def lightness_alone(self, spectrum):
        """Returns the seen L*, [count, count], of one material with this spectrum in black on white."""
        return lightness(1 - np.fft.irfft2(spectrum * self.grey, (self.count, self.count)))


def depth_weights(length_mm, step_mm, count):
    """Returns the weights [count] of steps below the surface: the integral of exp(-z / l) / l over each, scaled to a sum of 1."""
    if length_mm == 0:
        return np.eye(1, count)[0]
    edges = np.exp(-np.arange(count + 1) * step_mm / length_mm)
    return (edges[:-1] - edges[1:]) / (1 - edges[-1])


def frame(normal):
    """Returns unit vectors u, v, n: v and u lie in a plane with this normal; a right-handed frame."""
    n = np.asarray(normal, float)
    n = n / np.linalg.norm(n)
    u = np.cross(np.eye(3)[np.argmin(np.abs(n))], n)
    u /= np.linalg.norm(u)
    return u, np.cross(n, u), n
