import numpy as np
import pytest

from dynresp.locomotion.vision.video_reader import Video
from dynresp.support.errors import MotionFileError
from studies.video.filming import SIZE, write_video


@pytest.mark.parametrize(("codec", "ending"), [("mp4v", "mp4"), ("MJPG", "avi")])
def test_a_file_is_read(codec, ending, tmp_path) -> None:
    path = tmp_path / f"video.{ending}"
    pictures = [np.full((SIZE[1], SIZE[0], 3), 20 * k, dtype=np.uint8) for k in range(10)]
    write_video(path, iter(pictures), 25.0, codec)
    with Video(path) as video:
        assert video.fps == pytest.approx(25.0)
        read = list(video)
    assert len(read) == 10
    assert read[0].shape == (SIZE[1], SIZE[0], 3)
    assert read[9].mean() == pytest.approx(180.0, abs=6.0)


def test_what_cannot_be_read_is_refused(tmp_path) -> None:
    with pytest.raises(MotionFileError, match="no such file"):
        Video(tmp_path / "none.mp4")
    with pytest.raises(MotionFileError, match="is a folder"):
        Video(tmp_path)
    text = tmp_path / "text.mp4"
    text.write_text("not a video")
    with pytest.raises(MotionFileError, match="cannot be opened"):
        Video(text)
    cut = tmp_path / "cut.avi"
    write_video(cut, iter([np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8)] * 5), 25.0, "MJPG")
    cut.write_bytes(cut.read_bytes()[:300])
    with pytest.raises(MotionFileError, match=r"cut\.avi"), Video(cut) as video:
        list(video)
    with pytest.raises(MotionFileError, match="camera 99"):
        Video(99)


def test_a_name_that_is_not_utf_8(tmp_path) -> None:
    path = tmp_path / "x\udcff.avi"
    try:
        path.write_bytes(b"RIFF")
    except (OSError, UnicodeEncodeError):
        pytest.skip("file names are UTF-8 here")
    with pytest.raises(
        MotionFileError, match=r"udcff\.avi: the name is not UTF-8; rename"
    ) as error:
        Video(path)
    str(error.value).encode()
