// Cameras in place of those of the machine: by name, the frames of each, of which it shows `fakeMedia.frame`.
(cameras) => {
  window.fakeMedia = { open: [], refuse: "", frame: 0 };
  const devices = Object.keys(cameras).map((name) => ({ deviceId: name, kind: "videoinput", label: name }));
  navigator.mediaDevices.enumerateDevices = async () => devices;
  const images = new Map();
  const loaded = async (url) => {
    if (!images.has(url)) {
      const image = new Image();
      image.src = url;
      await image.decode();
      images.set(url, image);
    }
    return images.get(url);
  };
  navigator.mediaDevices.getUserMedia = async ({ video }) => {
    const media = window.fakeMedia;
    if (media.refuse) throw new DOMException("refused", media.refuse);
    const name = video.deviceId?.exact ?? devices[0].deviceId;
    const frames = await Promise.all(cameras[name].map(loaded));
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: frames[0].width, height: frames[0].height });
    const context = canvas.getContext("2d");
    const stream = canvas.captureStream(10);
    const [track] = stream.getVideoTracks();
    track.getSettings = () => ({ deviceId: name, width: canvas.width, height: canvas.height });
    media.open.push({ name, track });
    const draw = () => {
      if (track.readyState === "ended") clearInterval(drawing);
      context.drawImage(frames[Math.min(media.frame, frames.length - 1)], 0, 0);
    };
    const drawing = setInterval(draw, 100);
    draw();
    return stream;
  };
}
