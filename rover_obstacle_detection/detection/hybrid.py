"""proto"""
from __future__ import annotations
import math
from collections.abc import Callable
import cv2
import numpy as np
from rover_obstacle_detection.detection.camera import StereoCamera
from rover_obstacle_detection.detection.config import DetectorConfig
from rover_obstacle_detection.detection.detection import Detection
from rover_obstacle_detection.detection.disparity import Penalties, penalties
from rover_obstacle_detection.detection.gravity import Gravity, GroundPlane
from rover_obstacle_detection.detection.ground_plane import DisparityPlane, estimate_ground
from rover_obstacle_detection.detection.image import GreyPair
from rover_obstacle_detection.detection.warped_matching import *
from rover_obstacle_detection.detection.elevation_map import *
from rover_obstacle_detection.detection.local_ground import local_ground, _gaussian, _regress
from rover_obstacle_detection.detection.clearance import grown_from_cores
from rover_obstacle_detection.detection.noise import *

PENALTIES = Penalties(300, 1200)
import os
P = dict(cell=0.04, opening=0.8, trend=0.4, smooth=0.16, tol=0.05, core=0.95, foot=0.02, footk=2.0, corek=0.0, mincore=5, med=1, slope_sigma=0.1, drop=1, slope=1, reg=2, sp=15, sr=20, minreg=50, gf=1, gfr=8, gfe=20)
for kv in os.environ.get('HP','').split(','):
    if kv: P[kv.split('=')[0]] = float(kv.split('=')[1])

from rover_obstacle_detection.detection.segmentation import mean_shift_regions
def guided(I, p, r, e):
    h, w = p.shape
    I2 = cv2.resize(I, (w//2, h//2), interpolation=cv2.INTER_AREA).astype(np.float32); p2 = cv2.resize(p, (w//2, h//2), interpolation=cv2.INTER_AREA)
    r = r//2
    b = lambda x: cv2.blur(x, (2*r+1, 2*r+1))
    mI, mp = b(I2), b(p2)
    a = (b(I2*p2)-mI*mp)/(b(I2*I2)-mI*mI+e)
    bb = mp - a*mI
    a, bb = b(a), b(bb)
    return cv2.resize(a,(w,h))*I + cv2.resize(bb,(w,h))

def detect_hybrid(pair, camera, config, gravity, finished):
    left, right = pair
    penalty = penalties(config, PENALTIES)
    coarse = coarse_disparity(left, right, camera, config, penalty, 4)
    finished('coarse disparity')
    ground = estimate_ground(coarse.disparity, coarse.camera, config, gravity)
    plane_c = DisparityPlane.from_ground(ground, coarse.camera)
    plane = DisparityPlane.from_ground(ground, camera)
    finished('ground plane')
    expected = plane.disparity(camera)
    search = residual_range(coarse, plane_c)
    disparity = warped_disparity(left, right, camera, np.maximum(expected, 0), search, config, penalty)
    finished('disparity')
    # half
    d = disparity[::2, ::2]; e = expected[::2, ::2]
    if P['med']:
        d = cv2.medianBlur(np.ascontiguousarray(d), 5)
    d = np.ascontiguousarray(d)
    cam2 = StereoCamera(d.shape[1], d.shape[0], camera.fx/2, camera.fy/2, camera.cx/2, camera.cy/2, camera.baseline_m*2)
    valid = d > 0
    H = np.zeros_like(d)
    np.divide(np.float32(ground.height_m)*(d-e), d, out=H, where=valid)
    sig = height_noise_m(d, e, ground)
    pos = map_positions(d, cam2, ground, P['cell'], config.max_range)
    w = np.where(valid, 1.0, 0).astype(np.float32)
    w = np.where(valid, 1/(0.02**2+sig**2), 0).astype(np.float32) * 1e-3
    mean, weight = cell_means(H, w, pos)
    finished('elevation map')
    G = local_ground(mean, weight, P['cell'], opening_m=P['opening'], trend_m=P['trend'], smoothing_m=P['smooth'], tolerance_m=P['tol'])
    finished('local ground')
    height = H - sample_map(G, pos)
    height[pos.row < -5] = np.nan
    c = config.max_step
    foot = np.maximum(P['foot'], P['footk']*sig)
    core = P['core']*c + P['corek']*sig
    obst = grown_from_cores(height, core, foot, int(P['mincore']))
    finished('clearance')
    # slope, drop
    if P['slope']:
        present = (weight > 0).astype(np.float32)
        near = (np.abs(mean-G) < P['tol']) & (weight>0)
        k = np.ones((5,5),np.uint8)
        Gs = _gaussian(G, P['slope_sigma']/P['cell'])
        # up in map axes
        r, f = ground_axes(ground)
        up = np.asarray(ground.up); n = np.asarray(ground.normal)
        gy, gx = np.gradient(Gs, P['cell'])
        # surface normal in plane axes (-gx,-gy,1)
        cosang = (-gx*(r@up) - gy*(f@up) + (n@up)) / np.sqrt(1+gx**2+gy**2)
        steep = cosang < math.cos(math.radians(config.max_slope))
        seen = cv2.dilate(present, k) > 0
        if P['drop']:
            size = max(3, round(2.0/P['cell'])|1)
            closing = cv2.morphologyEx(Gs, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE,(size,size)))
            steep |= (closing - Gs) > c
        steep &= seen
        sl = sample_map(steep.astype(np.float32), pos) > 0.5
        sl[pos.row < -5] = False
        obst |= sl
    finished('slope')
    if P['reg']:
        q = (camera.width//4, camera.height//4)
        small = cv2.resize(left, q, interpolation=cv2.INTER_AREA)
        regions = mean_shift_regions(small, P['sp']/4, P['sr'], max(2,int(P['minreg']/16)))
        finished('segmentation')
        half = (obst.shape[1], obst.shape[0])
        reg2 = cv2.resize(regions, half, interpolation=cv2.INTER_NEAREST)
        n = int(reg2.max())+1
        judged = valid & (pos.row > -5)
        pts = np.bincount(reg2[judged], minlength=n)
        hit = np.bincount(reg2[judged & obst], minlength=n)
        verdict = hit > 0.5*np.maximum(pts,1)
        if P['reg'] == 2:
            obst = np.where(judged & (pts[reg2]<1e9), obst, verdict[reg2])
        if P['reg'] == 3:
            small_reg = verdict
            obst = verdict[reg2]
        if P['reg'] == 4:
            obst = obst | verdict[reg2]
    up_ = cv2.resize(obst.astype(np.float32), (camera.width, camera.height), interpolation=cv2.INTER_LINEAR)
    if P['gf']:
        up_ = guided(left, up_, int(P['gfr']), P['gfe'])
    mask = (up_ > 0.5).astype(np.uint8)*255
    finished('outline')
    hfull = lambda: cv2.resize(height, (camera.width, camera.height), interpolation=cv2.INTER_NEAREST)
    return Detection(camera=camera, config=config, ground=ground, products=dict(grey=left, disparity=disparity, mask=mask, height=hfull, known=disparity>0))
