// Painting over what covers the face in a photo, so that a fit leaves it out.

/// Shows the photo; resolves with a PNG mask that is white where it was painted, null if cancelled.
export async function paintCover(photo) {
  const dialog = document.getElementById("cover");
  const canvas = dialog.querySelector("canvas");
  const image = await createImageBitmap(photo);
  const scale = Math.min(1, 640 / Math.max(image.width, image.height));
  canvas.width = Math.round(image.width * scale);
  canvas.height = Math.round(image.height * scale);
  const mask = new OffscreenCanvas(canvas.width, canvas.height);
  const layers = [canvas.getContext("2d"), mask.getContext("2d")];
  layers[0].drawImage(image, 0, 0, canvas.width, canvas.height);
  layers[1].fillRect(0, 0, canvas.width, canvas.height);
  let from = null;
  const paint = (event) => {
    const box = canvas.getBoundingClientRect();
    const to = [(event.clientX - box.left) * canvas.width / box.width,
      (event.clientY - box.top) * canvas.height / box.height];
    for (const layer of layers) {
      layer.strokeStyle = "white";
      layer.lineCap = "round";
      layer.lineWidth = canvas.width / 12;
      layer.beginPath();
      layer.moveTo(...(from ?? to));
      layer.lineTo(...to);
      layer.stroke();
    }
    from = to;
  };
  canvas.onpointerdown = (event) => { canvas.setPointerCapture(event.pointerId); paint(event); };
  canvas.onpointermove = (event) => { if (event.buttons & 1) paint(event); };
  canvas.onpointerup = () => { from = null; };
  dialog.returnValue = "";
  dialog.showModal();
  await new Promise((resolve) => { dialog.onclose = resolve; });
  return dialog.returnValue === "fit" ? mask.convertToBlob({ type: "image/png" }) : null;
}
